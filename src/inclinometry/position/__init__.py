"""Where the well is and how sure that is: error models as data, their propagation along the path, ellipses."""
