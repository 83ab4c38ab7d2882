"""The plant as the user states it: bond graph, laws, units, text file, Python builder."""

from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
    from faultbond.model.builder import ModelBuilder
    from faultbond.model.expression import (
        FUNCTIONS,
        Binary,
        Call,
        Expression,
        Name,
        Negative,
        Number,
        names,
        rename,
        walk,
    )
    from faultbond.model.graph import BondGraph
    from faultbond.model.parser import parse_expression, parse_relation, to_text
    from faultbond.model.schema import model_schema
    from faultbond.model.text import dump_model, load_model, parse_model
    from faultbond.model.units import unit

__all__ = [
    "FUNCTIONS",
    "Binary",
    "BondGraph",
    "Call",
    "Expression",
    "ModelBuilder",
    "Name",
    "Negative",
    "Number",
    "dump_model",
    "load_model",
    "model_schema",
    "names",
    "parse_expression",
    "parse_model",
    "parse_relation",
    "rename",
    "to_text",
    "unit",
    "walk",
]

__getattr__ = lazily(
    "faultbond.model",
    {
        "builder": "ModelBuilder",
        "expression": "FUNCTIONS Binary Call Expression Name Negative Number names rename walk",
        "graph": "BondGraph",
        "parser": "parse_expression parse_relation to_text",
        "schema": "model_schema",
        "text": "dump_model load_model parse_model",
        "units": "unit",
    },
)
