"""What the report says, for good, bad and incomplete input."""

from dataclasses import replace

import pytest

from cuspline.report import facts, wording


def test_missing_numbers_become_dashes():
    for spell in (wording.decimal, wording.grouped, wording.short, wording.duration, wording.file_size, wording.place):
        assert spell(None) == wording.DASH
    assert wording.decimal(float("nan")) == wording.percent(None, 3) == wording.DASH


def test_a_share_below_all_is_never_rounded_up_to_all():
    assert wording.percent(99.9999, 100, 2) == "99.99 %"
    assert wording.percent(100, 100, 2) == "100.00 %"


def test_minus_zero_is_zero():
    assert wording.decimal(-0.00001) == "0.000"


def test_a_clean_verdict_is_green(sample_bundle):
    verdict = facts.verdict(sample_bundle.verify)
    assert (verdict.state, verdict.headline) == (facts.VERIFIED, "VERIFIED")


def test_findings_make_it_red_and_name_their_kinds(refused_bundle):
    verdict = facts.verdict(refused_bundle.verify)
    assert verdict.state == facts.REFUSED and verdict.headline == "NOT VERIFIED, 2 findings"
    assert "gouge" in verdict.sentence and "holder contact" in verdict.sentence


@pytest.mark.parametrize("verify", [{}, {"ok": None}, {"ok": False, "findings": []}, {"ok": "true"}])
def test_no_clear_ok_is_red(verify):
    assert facts.verdict(verify).state == facts.REFUSED


def test_ok_beside_an_open_finding_is_red(refused_bundle):
    assert facts.verdict({**refused_bundle.verify, "ok": True}).state == facts.REFUSED


@pytest.mark.parametrize("accept", [
    lambda v: {**v, "ok": True, "accepted": ["gouge", "holder_contact"]},
    lambda v: {**v, "ok": True, "accepted": {"gouge": "in the runout", "holder_contact": "measured by hand"}},
    lambda v: {**v, "ok": True, "findings": [{**f, "accepted": True} for f in v["findings"]]}])
def test_accepted_findings_stay_in_sight(refused_bundle, accept):
    verify = accept(refused_bundle.verify)
    verdict = facts.verdict(verify)
    assert verdict.state == facts.ACCEPTED and verdict.headline == "VERIFIED, 2 accepted findings"
    tiles = {tile.label: tile.details for tile in facts.one_minute(replace(refused_bundle, verify=verify))}
    assert "1 above what is allowed, accepted by name" in tiles["Gouge, deepest"]
    assert all(row.is_accepted for row in facts.findings(verify))


def test_a_fact_is_bad_because_of_its_finding(refused_bundle):
    states = {fact.label: fact.state for fact in facts.one_minute(refused_bundle)}
    assert states["Gouge, deepest"] == "bad" and states["Cusp, largest"] == "good"


def test_the_minute_holds_cutter_cusp_area_time_and_program(sample_bundle):
    text = "\n".join(f"{f.label}: {f.value} {' '.join(f.details)}" for f in facts.one_minute(sample_bundle))
    for part in ("T3 ball ∅10", "minimum concave radius 8 mm", "accepted to 0.025 mm: scallop + tolerance",
                 "planned for 0.015 mm", "stepover 0.8 mm", "0.0191 mm", "99.26 %",
                 "21.3 mm²", "LinuxCNC", "setup-1.ngc", "60 × 40 × 20 mm"):
        assert part in text


def test_nothing_crashes_on_empty_plan_and_verdict(sample_bundle):
    empty = replace(sample_bundle, plan={}, verify={})
    assert facts.operation_rows(empty) == [] and facts.candidate_rows(empty) == []
    assert all(f.value for f in facts.one_minute(empty))
    bare = replace(sample_bundle, plan={"setups": [{"name": "setup-1", "operations": [{}]}]},
                   verify={"findings": [{}], "setups": [{}]})
    assert facts.operation_rows(bare)[0]["tool"] == wording.DASH
    assert facts.findings(bare.verify)[0].advice == wording.DASH
    assert facts.measure_rows(bare)


def test_minimum_z_is_of_cutting_moves_in_the_wcs(sample_bundle):
    setup = sample_bundle.setups[0]
    mine = (setup.path.operation == 1) & ~setup.path.is_rapid
    assert facts.minimum_z_mm(setup, 1) == pytest.approx(setup.path.points_mm[mine, 2].min() - 22.0)
    assert facts.minimum_z_mm(setup, 7) is None


def test_a_finding_shows_its_block_and_the_axes(refused_bundle):
    gouge, holder = facts.findings(refused_bundle.verify)
    assert gouge.block.startswith("N3120") and gouge.machine == "X 131.500  Y 112.000  Z −80.000"
    assert holder.block == "" and holder.machine == wording.DASH


def test_cusps_and_meshes_become_rows(sample_bundle):
    (row,) = facts.cusp_rows(sample_bundle.verify)
    assert row["measured"] == "16.10 / 17.71 / 19.32" and row["agrees"] == "62.0 %" and row["differs"] == "3.00"
    assert facts.cusp_rows({}) == facts.mesh_rows({}) == facts.region_rows({}) == []
    assert facts.mesh_rows({"setups": [{"setup": "a", "mesh": {"left_out": "no such thing"}}]}) == [("left out", "no such thing")]
    view = {"stock_to_design": {"max_mm": 0.01, "mean_mm": 0.003, "points": 12}, "max_residual_mm": 0.01, "mean_residual_mm": 0.003}
    mesh = {"design": {"triangles": 9, "smallest_angle_deg": 2.5, "flipped": 1, "open_edges": 0},
            "hausdorff": {**view, "design_to_stock": view["stock_to_design"]}}
    rows = dict(facts.mesh_rows({"setups": [{"setup": "a", "mesh": mesh}]}))
    assert rows["a: triangles of the design"] == "9, smallest angle 2.50°, flipped 1"


def with_certificate(bundle, moves, not_covered):
    verify = {**bundle.verify, "gouge_proven_mm": 0.0028}
    verify["setups"] = [{**verify["setups"][0], "certificate": {"moves": moves, "not_covered": not_covered}}]
    return "\n".join(facts.one_minute(replace(bundle, verify=verify))[3].details)


def test_the_proof_names_how_many_moves_it_does_not_hold_for_and_why(sample_bundle):
    words = with_certificate(sample_bundle, {"feeds": 12, "arcs": 88}, {"the program does not say where the move begins": 2})
    assert "proven for 100 of 102 moves: at most 0.0028 mm" in words
    assert "no proof for 2 moves: the program does not say where the move begins" in words


def test_a_whole_proof_says_every_move(sample_bundle):
    assert "proven for every move: at most 0.0028 mm" in with_certificate(sample_bundle, {"feeds": 12}, {})


def test_the_first_screen_states_what_the_verdict_accepts(sample_bundle, refused_bundle):
    gouge, left = facts.limits(sample_bundle)
    assert gouge == ("Deepest gouge", "0.0008 mm", "0.003", "good")
    assert left == ("Most material left", "0.0191 mm", "0.025 (scallop 0.02 + tolerance 0.005)", "good")
    assert facts.limits(refused_bundle)[0][3] == "bad"


def test_the_first_screen_tells_what_is_accepted_though_no_cutter_comes_there(sample_bundle):
    rows = [{"area_mm2": 184.4, "largest_deviation_mm": 2.0}, {"area_mm2": 0.01, "stays_radius_mm": 4.0}]
    told = lambda found: facts.not_reached(replace(sample_bundle, verify={**sample_bundle.verify, "unreachable": found}))
    assert told(rows) == ["184.4 mm² out of reach with up to 2.000 mm left"] and told([]) == []
