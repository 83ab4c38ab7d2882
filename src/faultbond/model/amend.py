"""A model file with more in it: values under keys that may not stand there yet; all else stays as it was written."""

from collections.abc import Mapping, Sequence

import yaml

from faultbond.errors import ModelError

Path = tuple[str, ...]  # keys from the top of the file


def amended(text: str, values: Sequence[tuple[Path, str]], file: str = "model") -> str:
    """Give a model text with values put at paths of keys, in place of what stands there or behind the last key.

    Where a short form stands for a table, as `K: 3 ohm` for a parameter, it becomes the first value of a table.

    Raises
    ------
    ModelError
        Where a path leads into something that is no table.
    """
    for path, value in values:
        text = _put(text, path, value, file)
    return text


def with_correlations(text: str, rows: Mapping[str, Mapping[str, str]]) -> str:
    """Give a model text with these correlations, by name and name, in place of what stands there.

    They stand behind all else where there were none.
    """
    lines = [
        f"  {name}: {{{', '.join(f'{other}: {value}' for other, value in row.items())}}}" for name, row in rows.items()
    ]
    top = yaml.compose(text, Loader=yaml.SafeLoader)
    if not isinstance(top, yaml.MappingNode) or top.flow_style:
        whole = ", ".join(line.strip() for line in lines)
        return amended(text, [(("correlations",), f"{{{whole}}}")]) if rows else text
    section = "\n".join(["correlations:", *lines, ""]) if rows else ""
    found = next((item for item in top.value if item[0].value == "correlations"), None)
    if found is None:
        return f"{text.rstrip()}\n{section}" if rows else text
    first, last = found[0].start_mark.index, _end(found[1])
    line_end = text.find("\n", last)
    return text[:first] + section + ("" if line_end < 0 else text[line_end + 1 :])


def _short(path: Path) -> str:
    """Give the key that a plain value at a path stands for; empty where none can stand there."""
    match path:
        case (_, _, "parameters", _):
            return "nominal"
        case (_, _, "lag" | "rate_limit"):
            return "value"
        case ("inputs", _):
            return "unit"
    return ""


def _put(text: str, path: Path, value: str, file: str) -> str:
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(path):
        if isinstance(node, yaml.ScalarNode) and (short := _short(path[:depth])):  # a short form, or nothing
            stated = f"{short}: {text[node.start_mark.index : node.end_mark.index]}, " if node.value else ""
            table = f"{{{stated}{key}: {value}}}"
            gap = "" if node.value or text[node.start_mark.index - 1 : node.start_mark.index] == " " else " "
            return text[: node.start_mark.index] + gap + table + text[node.end_mark.index :]
        if not isinstance(node, yaml.MappingNode):
            raise ModelError(f"{file}: `{'.'.join(path)}` cannot be written, since `{path[depth - 1]}` is no table")
        found = next((item for name, item in node.value if name.value == key), None)
        if found is None:
            new = value
            for inner in reversed(path[depth + 1 :]):
                new = f"{{{inner}: {new}}}"
            return _with_key(text, node, key, new)
        node = found
    if node is None:
        raise ModelError(f"{file}: the model is empty")
    begin, last = node.start_mark.index, _end(node)
    deeper = "  " if isinstance(node, yaml.SequenceNode) and not node.flow_style else ""  # `-` may stand below its key
    end = "\n" if text[begin:last].endswith("\n") else ""  # a text in lines goes up to the next line
    return text[:begin] + deeper + value + end + text[last:]


def _with_key(text: str, table: yaml.MappingNode, key: str, value: str) -> str:
    """Put a key behind the last of a table, written as the table is."""
    if table.flow_style:
        end = table.end_mark.index - 1
        comma = ", " if table.value else ""
        head = text[:end].rstrip() if comma else text[:end]
        return f"{head.removesuffix(',')}{comma}{key}: {value}{text[end:]}"
    last, line = _end(table), f"{' ' * table.value[0][0].start_mark.column}{key}: {value}"
    if text[:last].endswith("\n"):  # the last value is a text in lines
        return f"{text[:last]}{line}\n{text[last:]}"
    line_end = text.find("\n", last)
    line_end = len(text) if line_end < 0 else line_end
    return f"{text[:line_end]}\n{line}{text[line_end:]}"


def _end(node: yaml.Node) -> int:
    """Give where the text of a node ends; of a table or a list in lines, that of its last value."""
    if isinstance(node, yaml.MappingNode) and not node.flow_style and node.value:
        return _end(node.value[-1][1])
    if isinstance(node, yaml.SequenceNode) and not node.flow_style and node.value:
        return _end(node.value[-1])
    return int(node.end_mark.index)
