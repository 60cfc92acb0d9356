"""Every physical sabotage is told with kind, line and amount; every harmless edit stays green: two parts, both dialects."""

import numpy as np
import pytest
from physical_programs import bases, findings
from physical_sabotages import HARMLESS, SABOTAGES

BASES = {f"{b.name}-{b.dialect}": b for b in bases()}
SEEDS = 2


@pytest.mark.parametrize("name", BASES)
def test_a_program_as_posted_has_no_finding(name):
    assert findings(BASES[name], BASES[name].text) == ()


@pytest.mark.parametrize("sabotage", SABOTAGES, ids=lambda s: s.__name__)
@pytest.mark.parametrize("name", BASES)
def test_a_sabotage_is_told_with_its_line_and_amount(name, sabotage):
    for seed in range(SEEDS):
        spoilt = sabotage(BASES[name], np.random.default_rng(seed))
        told = findings(BASES[name], spoilt.text)
        assert spoilt.is_told(told), (seed, spoilt.kind, spoilt.line, spoilt.amount_mm, told)


@pytest.mark.parametrize("edit", HARMLESS, ids=lambda e: e.__name__)
@pytest.mark.parametrize("name", BASES)
def test_a_harmless_edit_stays_green(name, edit):
    text = edit(BASES[name], np.random.default_rng(len(name)))
    assert text != BASES[name].text and findings(BASES[name], text) == ()
