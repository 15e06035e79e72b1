"""`annotate --clause`: further models get tiers of their own, from recordings and tables of real trackers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pympi.Elan import Eaf

import signface as sf
from signface.annotation import find_clause
from signface.cli.main import main
from signface.errors import SignfaceError
from tests.fixtures.third_party import third_party_file


@pytest.mark.slow
def test_a_further_model_gets_a_tier_of_its_own(tmp_path):
    take = str(sf.datasets.mini_file("M1_IE_J"))
    assert main(["annotate", take, "-o", str(tmp_path / "x.eaf"), "--signer", "M1", "--clause", "thesis-forest"]) == 0
    eaf = Eaf(str(tmp_path / "x.eaf"))
    names = set(eaf.get_tier_names())
    assert {"affect@M1", "affect-confidence@M1", "affect-thesis-forest@M1"} <= names
    alone = sf.annotate(sf.read_take(take), sf.load_model("thesis-forest"))
    told = [row[2] for row in eaf.get_annotation_data_for_tier("affect-thesis-forest@M1")]
    assert told == alone.segments.table["label"].tolist()


@pytest.mark.slow
def test_script_and_command_find_the_same_clause(tmp_path):
    take = sf.datasets.mini_take("M1_IE_J")
    model = sf.load_model("thesis-forest")
    one = find_clause(take, model)
    other = sf.annotate(take, sf.load_model(), clauses=[model]).clauses[0]
    assert other.segments == one.segments
    assert (one.tier, other.tier) == ("affect", "affect-thesis-forest")


@pytest.mark.slow
def test_real_tables_of_one_signer_get_brows_head_and_clauses(tmp_path, capsys):
    table = third_party_file("real/samples/p0003_c02s0014w0042.csv")
    copies = []
    for number in range(2):  # two takes of one signer: rest and level come from both
        copies.append(tmp_path / f"take{number}.csv")
        copies[-1].write_bytes(Path(table).read_bytes())
    arguments = ["annotate", *map(str, copies), "-o", str(tmp_path / "out"), "--signer", "p3", "--channels"]
    assert main([*arguments, "--clause", "lse-questions"]) == 0
    eaf = Eaf(str(tmp_path / "out" / "take0.eaf"))
    assert {"brows@p3", "head@p3", "clause@p3", "clause-confidence@p3"} <= set(eaf.get_tier_names())
    values = {row[2] for row in eaf.get_annotation_data_for_tier("clause@p3")}
    assert values <= {"wh", "polar", "negation"}
    vocabulary = {value[0][0][0] for value in eaf.controlled_vocabularies["questions"][1].values()}
    assert vocabulary == {"wh", "polar", "negation"}


def test_a_model_of_other_columns_says_what_is_missing():
    units = sf.Descriptors(np.zeros((20, 1)), ("AU01",), 25.0)
    with pytest.raises(SignfaceError, match="other bases"):
        find_clause(units, sf.load_model("thesis-forest"))
