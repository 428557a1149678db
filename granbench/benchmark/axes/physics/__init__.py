"""Laws of mechanics that a model must keep, and the accuracy of its tangent."""
