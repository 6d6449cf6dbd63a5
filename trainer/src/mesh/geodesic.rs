//! Distances along the surface: the heat method, and edge-unfolding Dijkstra to check it against.
