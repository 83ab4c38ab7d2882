"""`valid_when` in a model file: what it may say, and what it is told where it may not."""

import pytest

from faultbond.errors import ModelError
from faultbond.model.parser import parse_condition, to_text
from faultbond.model.text import parse_model

TEXT = """
sample_time: 1 s
constants: {idle: 300 rpm, warm: 5 degC}
inputs: {speed: {unit: rpm}, mode: {}, T: {unit: degC}}
components:
  src: {type: Se, law: e = k*speed, parameters: {k: 1 Pa*s}}
  R: {type: R, parameters: {R: 2 Pa*s/m^3}}
  tank: {type: C, parameters: {C: 1 m^3/Pa}}
junctions: {line: 1}
bonds: [src -> line -> R, line -> tank]
sensors: {flow: {reads: line.f, unit: m^3/s, noise: 0.1}}
"""
WRONG = {
    "mode = 1": "write `==` to compare",
    "1 == 1": "is the same in every row, since it names no input",
    "idle > 3": "is the same in every row",
    "mode": "it is a comparison, such as `mode == 1`",
    "T > 5": "T is in degC, but numbers in conditions are SI, as in laws; state the number under constants",
    "speed > 300": "speed is in rpm, but numbers",
    "R > 1": "`R` is a parameter, which a fault may change",
    "flow > 1": "`flow` is a sensor, and a fault that moves it would switch off what is to find it",
    "line.f > 0": "`line.f` is a signal of the model, which is not known where the model does not hold",
    "mod == 1": "unknown name `mod`; did you mean `mode`",
    "mode == 1 & speed > idle": "write `and`",
    "not mode == 1": "turn the comparison",
    "!mode": "turn the comparison",
    "speed > warm": "the two sides disagree",
    "0 < mode < 2": "compare two things at a time",
    "table(mode, x) == 1": "a condition has no `table`",
    "mode == 1/0": "divides by zero",
}


@pytest.mark.parametrize(("when", "message"), WRONG.items(), ids=lambda text: text)
def test_what_is_no_condition_of_inputs_is_refused(when: str, message: str) -> None:
    """Each with the place, and what to do."""
    with pytest.raises(ModelError, match=r"^m\.yaml:13: valid_when: when: ") as caught:
        parse_model(TEXT + f'\nvalid_when: "{when}"\n', file="m.yaml")
    assert message in str(caught.value)


@pytest.mark.parametrize("when", ["mode == 1", "mode != 1 and (speed > idle or T <= warm)", "speed > 0 or mode >= 2"])
def test_a_condition_stays_the_same_through_the_text(when: str) -> None:
    """What is written of a model reads back as the same, of all of it and of a sensor."""
    assert to_text(parse_condition(when)) == when
    sensor = TEXT.replace("noise: 0.1}", f'noise: 0.1, valid_when: {{when: "{when}", settling: 30 s}}}}')
    for text in (
        TEXT + f'\nvalid_when: {{when: "{when}", settling: 2 min}}\n',
        TEXT + f'\nvalid_when: "{when}"\n',
        sensor,
    ):
        graph = parse_model(text)
        again = parse_model(graph.text)
        assert (again.valid_when, again.sensors[0].valid_when) == (graph.valid_when, graph.sensors[0].valid_when)
        assert again.text == graph.text


def test_an_input_that_only_says_the_state_is_no_suspect() -> None:
    """No reading would show that it is wrong."""
    graph = parse_model(TEXT + "\nvalid_when: mode == 1 and speed > idle\n")
    assert [item.suspect for item in graph.inputs] == [True, False, True]


def test_two_sensors_of_one_column_each_say_when_they_read_it() -> None:
    """A meter that a valve turns to another pipe; without that one of both is a slip of the hand."""
    one = "flow: {reads: line.f, unit: m^3/s, noise: 0.1, column: F, valid_when: mode == 1}"
    other = "rest: {reads: tank.f, unit: m^3/s, noise: 0.1, column: F, valid_when: mode == 0}"
    text = TEXT.replace("flow: {reads: line.f, unit: m^3/s, noise: 0.1}", f"{one}, {other}")
    assert [item.column for item in parse_model(text).sensors] == ["F", "F"]
    with pytest.raises(ModelError, match="sensor rest: its column 'F' is that of the sensor flow too"):
        parse_model(text.replace(", valid_when: mode == 1", ""))


def test_settling_is_a_time() -> None:
    """Of zero or more."""
    for text, message in (("-3 s", "0 or more|negative"), ("3 m", "time")):
        with pytest.raises(ModelError, match=message):
            parse_model(TEXT + f"\nvalid_when: {{when: mode == 1, settling: {text}}}\n")


def test_a_network_without_time_has_no_states() -> None:
    """Its rows that are not to be judged are left out of the recording."""
    text = "sample_time: none\ninputs: {x: {}}\nblocks: {A: {law: y = a*x, parameters: {a: 2}}}\nsensors: {y: {}}\n"
    text = text.replace("{y: {}}", "{y: {reads: y}}")
    with pytest.raises(ModelError, match="no states of operation"):
        parse_model(text + "valid_when: x == 1\n")
    with pytest.raises(ModelError, match="no states of operation"):
        parse_model(text.replace("{reads: y}", "{reads: y, valid_when: x == 1}"))
