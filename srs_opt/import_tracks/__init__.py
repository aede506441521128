"""Recordings of any camera system become a measured data set."""
