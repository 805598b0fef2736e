"""Standard output that says that it is a terminal."""

import io


class TerminalText(io.StringIO):
    """What a person would see."""

    def isatty(self) -> bool:
        return True
