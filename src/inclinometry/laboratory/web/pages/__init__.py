"""The pages, one module a subject; importing a module registers its pages."""
