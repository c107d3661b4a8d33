"""What a flight says: findings with evidence, spectra and responses, and how two flights differ.

Recordings come in, numbers and texts go out; `msggen.exports.report` draws them.
"""
