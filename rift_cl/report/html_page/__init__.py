"""One self-contained HTML page: text, tables and pictures in a single file that needs no network.

Reports are mailed, archived and opened years later, so style and pictures are inside the file, no
script runs but the page's own few lines, and a content policy in the page forbids every request
and any other script. Where scripts do not run at all, everything is still there to be seen.
"""

from rift_cl.report.html_page.page import Page
from rift_cl.report.html_page.pictures import Compared

__all__ = ["Compared", "Page"]
