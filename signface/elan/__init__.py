"""ELAN: tiers, vocabularies and linked curves written and read as annotators' files.

Writing
    `output.write_take` (everything of a take), `export.write_eaf` (a file of our own, or from a template),
    `export.write_into` (into an annotator's file), `curves.write_curves`, `curves.write_tsconf`
Reading
    `reference.read_reference`, `reference.read_tiers`, `reference.read_corrections`, `document.read_document`,
    `checking.check_document`
What a tier holds
    `tiers.Tier`, `tiers.affect_tier`, `tiers.doubtful_tier`, `channels.channel_tiers`, `vocabularies.AFFECT`
A lab's own tiers
    `mapping.read_mapping`, `mapping.suggest_mapping`
Run by ELAN
    `recogniser.write_extension`
"""
