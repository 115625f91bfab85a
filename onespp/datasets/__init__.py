"""Data sets: many drawn animations in one folder, from one plan.

    DIR/dataset.json, README.md        the plan and what there is; a card for people
    DIR/train/000000/sequence.json     what was drawn, and the hashes of the files; written last
    DIR/train/000000/seed0/            a sequence, as `onespp render` makes; it has the references
    DIR/train/000000/seed1/            the same frames with other noise
    DIR/failures/000003.txt            what went wrong, of sequences that could not be made
"""
