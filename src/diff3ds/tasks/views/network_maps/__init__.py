"""Maps that networks make of posed photographs: edges and masks."""
