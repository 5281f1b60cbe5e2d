"""Mission specifications: missions as structured data, the way an agent proposes them."""
