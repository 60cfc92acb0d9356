"""A seeded share of the spoilt LinuxCNC texts: the interpreter makes the moves that are read, or both refuse."""

import pytest
import sabotages
from sabotage_bases import bases

from .linuxcnc import comparison

pytestmark = pytest.mark.linuxcnc

SHARE = 19


@pytest.mark.parametrize("of", [sabotages.cases, sabotages.harmless_cases])
def test_spoilt_and_edited_texts_are_read_as_linuxcnc_reads_them(tmp_path, of):
    chosen = list(filter(sabotages.is_linuxcnc_text, of(bases(tmp_path / "bases"))))[::SHARE]
    said = {str(case): sabotages.authority(case, tmp_path, comparison) for case in chosen}
    assert {case: word for case, word in said.items() if word not in sabotages.AGREED} == {}
    assert list(said.values()).count("same moves") > 8
