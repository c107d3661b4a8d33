"""`msggen docs`: the pages of a site about definitions, as texts by file name. Other modules write them to disk.

Pages link to each other with relative paths and load only files of the site, so that it can be read from a folder.
"""
