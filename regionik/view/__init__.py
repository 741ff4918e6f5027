"""Pictures of worlds, plans, areas and explanations: MeshCat, offline pages, figures."""
