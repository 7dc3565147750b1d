"""Checks of the engine against things that do not come from the engine.

``reference``: a slow, obvious NumPy integrator with force laws of its own. ``analytic``: closed
solutions. ``cases``: one function a case, each figure with its bound. ``crosscheck``: a bed that two
codes compute.
"""
