"""ELAN: tiers, vocabularies and linked curves written and read as annotators' files.

Writing
    `export.write_eaf` (a file of our own), `curves.write_curves`, `curves.write_tsconf`,
    `preferences.write_preferences`
Reading
    `reference.read_reference`, `document.read_document`
What a tier holds
    `tiers.Tier`, `tiers.affect_tier`, `vocabularies.AFFECT`
"""
