"""Python as a user writes it around builds: `make lint` holds the type checker against it."""

import cuspline


def deepest_gouge_mm(part: str, depths_mm: list[float]) -> float:
    """The deepest gouge of some variants of a part."""
    results = [cuspline.build(part, stage="verify", out=f"outputs/{depth}", depth_mm=depth) for depth in depths_mm]
    return max(r.verdict.gouge_max_mm for r in results if r.verdict is not None)


def slowest(folder: str) -> str:
    """The operation of a plan that takes longest."""
    plan = cuspline.outputs(folder).plan
    assert plan is not None
    return max((o for s in plan.setups for o in s.operations), key=lambda o: o.time_s).name
