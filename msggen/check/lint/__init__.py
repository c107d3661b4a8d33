"""`msggen lint`: a function for each rule about the quality of definitions, and the table of these rules."""
