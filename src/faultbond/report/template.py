"""Templates of pages, with which all pages are written alike."""

from jinja2 import Environment, PackageLoader, StrictUndefined, Template


def page_template(folder: str, name: str) -> Template:
    """Give a template: text is escaped, a name that is not told is an error, and data are JSON without nan.

    Parameters
    ----------
    folder : of the package faultbond
    name : of the file in it
    """
    environment = Environment(
        loader=PackageLoader("faultbond", folder),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False, "ensure_ascii": False}
    return environment.get_template(name)
