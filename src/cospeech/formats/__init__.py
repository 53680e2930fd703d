"""One reader per published layout: parse only, yield recordings."""
