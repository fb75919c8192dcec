"""From J to mechanics: what each step does to ln J, profiles over length, fits to measured J."""
