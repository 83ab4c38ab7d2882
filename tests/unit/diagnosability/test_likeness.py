"""Why faults do not show, or cannot be told apart, in structures whose answer is known by hand."""

from benchmarks.shared import published

from faultbond.diagnosability.likeness import Alike, Hidden, alike_faults, hidden_faults


def test_faults_of_a_class() -> None:
    """A law and the sensor behind it find one unknown together, and only together they check it."""
    model = published.structure("x\nx\nx y | f1\ny | f2\nx | f3")
    assert alike_faults(model) == (Alike(faults=(0, 1), equations=(2, 3), variables=(1,)),)
    assert hidden_faults(model) == ()


def test_faults_of_one_equation() -> None:
    """Two faults of one equation are alike though the equation is a class of its own, without unknowns of its own."""
    model = published.structure("x\nx | f1 f2\nx | f3")
    assert alike_faults(model) == (Alike(faults=(0, 1), equations=(1,), variables=()),)


def test_faults_that_nothing_checks() -> None:
    """An equation that is needed to find an unknown is named with the block that it is in."""
    model = published.structure("x\nx\nx y z | f1\nx y z\nz w | f2\nv u | f3")
    hidden = hidden_faults(model)
    names = model.variable_names
    assert [item.fault for item in hidden] == [0, 1, 2]
    assert hidden[0].equations == (2, 3)
    assert [names[k] for k in hidden[0].variables] == ["y", "z"]
    assert hidden[1] == Hidden(fault=1, equations=(4,), variables=(names.index("w"),))
    assert [names[k] for k in hidden[2].open] == ["v", "u"]
    assert alike_faults(model) == ()


def test_three_tanks() -> None:
    """In the published three tanks all that is behind the second flow is one class."""
    model = published.structure(published.THREE_TANK)
    (group,) = alike_faults(model)
    assert [model.fault_names[k] for k in group.faults] == ["fV2", "fV3", "fT3"]
    assert [model.variable_names[k] for k in group.variables] == ["p3", "q3", "dp3"]
    assert len(group.equations) == 4
