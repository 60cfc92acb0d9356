"""Neighbouring stretches that lie beside each other, gathered into what is cut in one go."""


def grouped(layers, lie_beside):
    """Chains of overlapping items through consecutive layers.

    Args:
        layers: iterable of lists of items, one list a row or section plane, in order across.
        lie_beside: function (item of one layer, item of the next) -> bool.
    Returns:
        list of lists; an item follows the first open chain whose last item it lies beside, else
        it opens a chain; a chain that no item of the next layer follows is closed.
    """
    groups, growing = [], []
    for layer in layers:
        still = []
        for item in layer:
            mine = next((g for g in growing if lie_beside(g[-1], item)), None)
            if mine is None:
                mine = []
                groups.append(mine)
            else:
                growing = [g for g in growing if g is not mine]
            mine.append(item)
            still.append(mine)
        growing = still
    return groups
