"""World files: the grammar of each part, and its reading and writing."""
