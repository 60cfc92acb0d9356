"""How a sound input is spoilt: bytes, words, lines, and the nodes of a document."""

import copy
import json

NUMBERS = ("nan", "inf", "-inf", "NaN", "Infinity", "-Infinity", "0", "-0.0", "-1", "1e-300", "1e308", "1e999", "-1e999",
           "1e9", "-1e9", "1e5", "0.1", "3", "9" * 400, "9" * 5000, "0x10", "1_000", "1,5", "½", "٣", "--3", "+", ".", "1e")
WORDS = ("", " ", "true", "null", "None", "[]", "{}", "[[[[", "\"", "'", "#", "=", "../../evil", "/etc/passwd", "a\0b", "\n",
         "\r", "\t", "\x1b[31m", "ä", "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"), "𝟛", "x" * 5000, "%s", "{0}",
         "$(id)", "`id`", ";", "-", "--", "\\", "<", "ball", "G54", "mm", "inch")
SCALARS = (None, True, False, 0, -1, 1, 3, 0.0, -0.0, 1e-300, 1e308, -1e9, 1e9, 2.5, float("nan"), float("inf"), float("-inf"),
           10 ** 400, "", " ", "../../evil", "a\0b", "ä\ud800", "x" * 3000, [], {}, [[]], [None], {"a": {"b": []}}, "mm", "5 mm",
           "1e999 mm", [1, 2], [1, 2, 3], [float("nan")] * 3, "ball", "-3", "nan")
ENCODINGS = ("utf-16", "utf-32", "utf-8-sig", "latin-1", "cp037")


def mangled_text(chance, text, separators=" ,=\t[]"):
    """Bytes of a text with one to four faults.

    Args:
        chance: random.Random.   text: str.   separators: what words stand between.
    """
    for _ in range(chance.choice((0, 1, 1, 1, 2, 2, 3, 4))):
        text = chance.choice((_word, _word, _word, _number, _number, _lines, _letters, _cut, _blown_up))(chance, text, separators)
    return _encoded(chance, text)


def _encoded(chance, text):
    if chance.random() < 0.03:
        return text.encode(chance.choice(ENCODINGS), "replace")
    content = bytearray(text.encode("utf-8", "surrogatepass"))
    if chance.random() < 0.06:
        for _ in range(chance.choice((1, 3, 20))):
            at = chance.randrange(len(content) + 1)
            content[at:at + chance.choice((0, 1))] = bytes([chance.randrange(256)])
    return bytes(content)


def _places(text, separators):
    """[(first, last)] of the words of a text."""
    spans, first = [], None
    for k, letter in enumerate(text + "\n"):
        if letter in separators or letter == "\n":
            if first is not None:
                spans.append((first, k))
            first = None
        elif first is None:
            first = k
    return spans


def _word(chance, text, separators):
    """Another word in the place of one."""
    spans = _places(text, separators)
    if not spans:
        return text + chance.choice(WORDS)
    low, high = chance.choice(spans)
    new = chance.choice((*WORDS, *NUMBERS)) if chance.random() < 0.7 else text[slice(*chance.choice(spans))]
    return text[:low] + new + text[high:]


def _number(chance, text, separators):
    """Another number in the place of one."""
    spans = [s for s in _places(text, separators) if any(c.isdigit() for c in text[slice(*s)])]
    if not spans:
        return text
    low, high = chance.choice(spans)
    first = next(k for k in range(low, high) if text[k].isdigit() or text[k] in "-.")
    return text[:first] + chance.choice(NUMBERS) + text[high:]


def _lines(chance, text, _):
    """A line lost, doubled, moved, or many times repeated."""
    lines = text.split("\n")
    k = chance.randrange(len(lines))
    kind = chance.randrange(4)
    if kind == 0:
        del lines[k]
    elif kind == 1:
        lines.insert(chance.randrange(len(lines) + 1), lines[k])
    elif kind == 2:
        other = chance.randrange(len(lines))
        lines[k], lines[other] = lines[other], lines[k]
    else:
        lines[k:k] = [lines[k]] * chance.choice((3, 50))
    return "\n".join(lines)


def _letters(chance, text, _):
    """A letter lost, doubled, exchanged or put in."""
    at = chance.randrange(len(text) + 1)
    new = chance.choice((text[at:at + 1] * 2, "", chance.choice("0123456789.-eE[]{}\"'#=,;()%GXYZIJKRFMTNO \n\t"),
                         chr(chance.choice((0, 7, 27, 127, 160, 0x2028, 0xfeff, 0x1f600)))))
    return text[:at] + new + text[at + chance.choice((0, 1)):]


def _cut(chance, text, _):
    """The end or the beginning is missing."""
    at = chance.randrange(len(text) + 1)
    return text[:at] if chance.random() < 0.7 else text[at:]


def _blown_up(chance, text, _):
    """Nested deeply, or one thing very often."""
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice(("[", "{", "(", "((", "a.", "\"", "-", "1", " ", "[[")) * chance.choice((40, 3000)) + text[at:]


def mangled_document(chance, document):
    """Bytes of a JSON document with one to four of its nodes spoilt, or its text."""
    if chance.random() < 0.25:
        return mangled_text(chance, json.dumps(document, indent=1), " ,:[]{}")
    holder = [json.loads(json.dumps(document))]
    for _ in range(chance.choice((1, 1, 1, 2, 3, 4))):
        _spoil(chance, holder)
    return json.dumps(holder[0]).encode("utf-8", "surrogatepass")


def _spoil(chance, holder):
    """Change one node somewhere below; `holder` is a list of the document."""
    nodes = [(holder, 0)]
    for inside, key in nodes:
        value = inside[key]
        if isinstance(value, (dict, list)) and len(nodes) < 3000:
            nodes += [(value, k) for k in (value if isinstance(value, dict) else range(len(value)))]
    inside, key = chance.choice(nodes)
    kind = chance.randrange(6)
    if kind <= 2:
        inside[key] = copy.deepcopy(chance.choice(SCALARS))
    elif kind == 3 and inside is not holder:
        del inside[key]
    elif kind == 4 and isinstance(inside, dict):
        name = str(key)
        inside[chance.choice((name[:-1], name + "s", name.upper(), "", name[1:] + name[:1]))] = inside.pop(key)
    elif kind == 5:
        other, where = chance.choice(nodes)
        inside[key] = json.loads(json.dumps(other[where]))


def mangled_bytes(chance, content):
    """Bytes cut off, exchanged, doubled, or changed one by one."""
    content = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 5, 40))):
        at, width = chance.randrange(len(content) + 1), chance.choice((1, 1, 4, 60, 800))
        kind = chance.randrange(5)
        if kind == 0:
            content[at:at + width] = b""
        elif kind == 1:
            content[at:at] = content[chance.randrange(len(content) + 1):][:width]
        elif kind == 2:
            content[at:at + 1] = bytes([chance.randrange(256)])
        elif kind == 3:
            content[at:at + 1] = chance.choice((b"#1", b"9", b"0", b"-", b"$", b"*", b"1E308", b",", b"(", b"NAN"))
        else:
            del content[chance.randrange(len(content) + 1):]
    return bytes(content)
