"""The grammar of world files, and the way from a document to a `World` and back."""
