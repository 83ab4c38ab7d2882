"""Method `classic`, the thesis' own: the on-line part. numpy only."""
