"""What a design's function hands over: one where several go, None where something is left out; anything else in one sentence."""

import cadquery as cq
import pytest

from cuspline.design import Auto, Design, FacePredicate, Finish, Parameters, Setup, StockAllowance
from cuspline.kernel import brep
from cuspline.planning.strategies.contour import Contour as AsItStands
from cuspline.values.errors import DesignError

FINISH = {"scallop_mm": 0.02, "profile_tolerance_mm": 0.005, "gouge_mm": 0.006}
TOP = FacePredicate(name="top", count=1, normal=(0, 0, 1))


class Nothing(Parameters):
    """Nothing to choose."""


def made(**other):
    """A Design of a block, its fields as somebody may hand them over."""
    fields = {"name": "block", "description": "block", "parameters": Nothing(), "solid": cq.Workplane().box(20, 10, 5).val(),
              "predicates": (TOP,), "material": "aluminium_6061", "finish": Finish(**FINISH),
              "setups": (Setup(name="setup-1", faces=("top",), wcs_in_words="middle"),)}
    return Design(**{**fields, **other})


def test_one_is_taken_where_several_go():
    setup = Setup(name="setup-1", faces="top", wcs_in_words="middle", operations=Auto())
    design = made(setups=setup, predicates=TOP)
    assert design.setups[0].faces == ("top",) and design.setups[0].operations == (Auto(),) and design.predicates == (TOP,)
    assert FacePredicate(name="walls", count=4, kinds="plane").kinds == ("plane",)


def test_none_is_left_out():
    design = made(stock=None, threads=None, dimensions=None, tools=None)
    assert design.stock == StockAllowance() and (design.threads, design.dimensions, design.tools) == ({}, (), ())


def test_a_finish_may_be_a_dict_of_its_keys():
    assert made(finish=FINISH).finish == Finish(**FINISH)
    with pytest.raises(DesignError, match=r"finish: profile_tolerance_mm: it is missing"):
        made(finish={"scallop_mm": 0.02})


@pytest.mark.parametrize(("field", "value", "says"), [
    ("finish", None, r"block, finish: it must be Finish\(...\), it is None"),
    ("stock", (20, 10, 5), r"block, stock: it must be a StockBox, .*, it is \(20, 10, 5\) \(tuple\)"),
    ("setups", ("setup-1",), r"block, setups: it must be Setup\(...\), it is 'setup-1' \(str\)"),
    ("material", None, "block, material: it must be a name of `cuspline materials`"),
    ("parameters", None, "block, parameters: it must be the value of its parameter model"),
    ("threads", "M6", "block, threads: it must be a dict"),
    ("predicates", {"top": ">Z"}, "a shape of CadQuery, build123d or OCP goes here, not '>Z'"),
])
def test_what_is_of_a_wrong_kind_is_refused_by_its_name(field, value, says):
    with pytest.raises(DesignError, match=says):
        made(**{field: value})


def test_a_predicate_without_a_number_says_how_to_state_one():
    with pytest.raises(ValueError, match="state count=N or at_least=1"):
        FacePredicate(name="walls", kinds=("plane",))


def test_a_list_or_workplane_of_two_solids_is_no_part_of_one():
    two = cq.Workplane().box(1, 1, 1).add(cq.Workplane().box(1, 1, 1).translate((5, 0, 0)))
    for shape in (two, two.vals()):
        with pytest.raises(DesignError, match="the part holds 2 solids"):
            brep.the_solid(shape)
    assert brep.the_solid(two.vals()[:1]) is not None


def test_operations_are_found_beside_the_design():
    from cuspline.design import Contour, LeadTilt
    assert Contour is AsItStands and LeadTilt(lead_deg=3).lead_deg == 3
    with pytest.raises(ImportError, match="Conture"):
        from cuspline.design import Conture  # noqa: F401
