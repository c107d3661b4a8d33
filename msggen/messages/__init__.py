"""Topics and messages of a generated package, without a link: names, values by paths, conditions, messages as text."""
