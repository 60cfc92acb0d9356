"""Data files that come with cuspline."""

from importlib import resources

from cuspline.values.input_files import checked, toml_of


def shipped(model, name, what):
    """A TOML file of the shop's data as a value of its model.

    Args:
        model: values.models.Model class.   name: of the file.   what: it holds, for messages.
    """
    return checked(model, toml_of(resources.files("cuspline.shop") / "data" / name, what), what)
