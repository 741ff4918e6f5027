"""Plans by Xu's tracker: a differential base and a pitch arm follow tool poses in closed form."""
