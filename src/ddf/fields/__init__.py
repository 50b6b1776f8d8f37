"""Level 2: sine networks, fields, their derivatives and losses, rendering, composition, projection to clouds."""
