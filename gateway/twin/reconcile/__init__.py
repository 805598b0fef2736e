"""From a recording and a believed rig to a verdict: where simulation and measurement part, what is missing, how sure that is."""
