"""Scans read from files: a reader for each format, and one contract for what a file holds.

``formats`` chooses the reader by the file's name and content; readers find arrays; ``contract``
settles what they are, by ``kind``, ``axes`` and ``angle_list``; ``scan_file`` describes the result.
"""
