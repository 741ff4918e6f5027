"""Points, polygons and solids as flat arrays, with compiled questions to them."""
