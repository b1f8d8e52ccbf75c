"""Checks XML by a schema, and prints what is wrong: a sentence on each line.

Arguments: the schema, the XML.
"""

import sys

from lxml import etree

schema = etree.XMLSchema(etree.parse(sys.argv[1]))
if not schema.validate(etree.parse(sys.argv[2])):
    print("\n".join(f"line {error.line}: {error.message}" for error in schema.error_log))
