class EightTerm:
    pass
