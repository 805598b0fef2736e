"""Text of unknown origin, as a terminal or a log may show it."""


def printable(text: str) -> str:
    """Return a text with every character escaped that steers a terminal, reverses the direction of text or begins a line."""
    return "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)


def counted(number: int, thing: str) -> str:
    """Return a number with what it counts: "1 gap", "2 gaps"."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
