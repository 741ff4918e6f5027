"""Set cover and interval cover of areas, short tours through them."""
