"""Filtered backprojection of parallel beams, fans, cones (FDK) and helices (Katsevich).

With it what the views want: their weights, Parker's and Wang's weights of rays measured twice
(``redundancy``), padding, offset axes and the rebinning of fans.
"""
