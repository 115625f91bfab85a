"""Light by way of smooth balls, through them and in them: a vertex looks for it as for light."""
