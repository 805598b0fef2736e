"""Authorisation of requests: who asks, with which role, and whether the request is fresh. Time is an argument of every call."""
