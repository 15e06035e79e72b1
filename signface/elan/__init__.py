"""ELAN: tiers, vocabularies and linked curves written and read as annotators' files.

Writing
    `writing.write_eaf` (what was found in a take: a new file, from a template, or into an annotator's file),
    `options.EafOptions` (how), `writing.to_pympi` (for scripts), `curves.write_curves`, `curves.write_tsconf`
Reading
    `reference.read_reference`, `annotators.read_tiers`, `reference.read_corrections`, `document.read_document`,
    `checking.check_document`, `table.annotation_table` (all tiers of many files)
What a tier holds
    `tiers.Tier`, `tiers.label_tier`, `tiers.doubtful_tier`, `channels.channel_tiers`, `vocabularies.read_vocabulary`
A lab's own tiers
    `mapping.read_mapping`, `mapping_draft.write_mapping`, `translation.translated`
Run by ELAN
    `recogniser.write_extension`
"""
