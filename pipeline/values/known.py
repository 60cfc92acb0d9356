"""What is worked out once."""


class Known(dict):
    """Values by what they are called, each made when it is first asked for."""

    def once(self, name, make):
        """The value of a name: `make`() the first time.

        >>> known = Known()
        >>> known.once("two", lambda: 2), known.once("two", lambda: 3)
        (2, 2)
        """
        if name not in self:
            self[name] = make()
        return self[name]
