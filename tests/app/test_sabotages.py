"""A seeded tenth of the sabotages and harmless edits; `make bench ARGS=sabotage` runs all of them."""

import pytest
import sabotages
from sabotage_bases import bases

SHARE, SEED = 10, 3
CUTS = 9                    # every so manieth of those that are simulated


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return bases(tmp_path_factory.mktemp("bases"))


def wrong(cases, tmp_path):
    """What was told of cases otherwise than it must be."""
    told = []
    for number, case in enumerate(cases):
        found = sabotages.outcome(case, tmp_path / str(number))
        if found.is_found if case.expected is None else not found.is_right:
            told.append(f"{case}: {case.expected}: {found.told}")
    return told


@pytest.mark.parametrize("is_text_only", [True, False], ids=["the base's text", "the base as it is cut"])
def test_the_jobs_that_are_spoilt_are_well(made, is_text_only):
    chosen = [b for b in made.values() if is_text_only or b.name in ("boss-macro", "boss-two-clampings")]
    assert [(b.name, b.judged(b.folder, is_text_only)) for b in chosen] == [(b.name, ()) for b in chosen]


def test_there_are_enough_of_them_and_the_same_every_time(made):
    spoilt, edited = ([list(cases(made)) for _ in range(2)] for cases in (sabotages.cases, sabotages.harmless_cases))
    assert len(spoilt[0]) >= 300 and len(edited[0]) >= 60
    assert [c.files for c in spoilt[0]] == [c.files for c in spoilt[1]]
    assert [c.files for c in edited[0]] == [c.files for c in edited[1]]


def test_what_the_text_shows_is_told_with_its_kind_line_and_amount(made, tmp_path):
    cases = [c for c in sabotages.cases(made) if not c.needs_solid]
    assert wrong(cases[SEED::SHARE], tmp_path) == []


def test_what_is_cut_wrongly_is_told_with_its_kind_line_and_amount(made, tmp_path):
    cases = [c for c in sabotages.cases(made) if c.needs_solid]
    assert wrong(cases[SEED::CUTS], tmp_path) == []


def test_harmless_edits_stay_green(made, tmp_path):
    assert wrong(list(sabotages.harmless_cases(made))[SEED::SHARE], tmp_path) == []
