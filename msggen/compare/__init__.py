"""Two catalogs to findings, by rule; how they were read, and how findings are shown, is not known here."""
