"""Text for viser's panels, which take Markdown and run whatever HTML is in it.

Names of photographs and the errors that quote them were written by others: they are shown, and
neither laid out nor run. So every text of a panel comes from ``markdown_of``.
"""

from __future__ import annotations

import string

# A character reference is never taken for markup, by Markdown (CommonMark 0.31, section 2.5) or by
# HTML; letters, digits and what is not ASCII mean nothing to either.
_REFERENCES = {ord(mark): f"&#{ord(mark)};" for mark in string.punctuation}


def markdown_of(text: str) -> str:
    """Markdown that shows a text as it is, line by line; white space is drawn together.

    Args:
        text: whatever a file or a path says. What is no character, as in a name of a file that is
            not UTF-8, becomes a question mark.
    """
    plain = text.encode(errors="replace").decode()
    lines = [" ".join(line.split()).translate(_REFERENCES) for line in plain.splitlines()]
    # Two spaces before its end make a line one of its own.
    return "  \n".join(lines)
