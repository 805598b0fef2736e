"""Command lines as help and documents show them."""

import re
import shlex

REMARK = r"\s+#\s|\s{3,}\("
SHELL = r" \|\|? | && | >{1,2} "


def command_words(line: str) -> list[str]:
    """The words of a command, without a remark behind it, and without what the shell does after it or with its output."""
    return shlex.split(re.split(f"{REMARK}|{SHELL}", line.strip())[0])
