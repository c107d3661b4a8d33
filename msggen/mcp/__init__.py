"""What assistants ask: definitions, recordings and a running vehicle, read only, by the Model Context Protocol.

Questions come in, answers of a limited length go out: JSON, in which texts of recordings and vehicles are data.
"""
