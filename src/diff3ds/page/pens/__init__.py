"""What a pen draws on a page: paths without doubled parts, joined at their ends, in an order of short ways."""
