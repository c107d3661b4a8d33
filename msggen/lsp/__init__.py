"""`msggen lsp`: the definitions, the checks and the explanations of msggen in an editor, by its language protocol."""
