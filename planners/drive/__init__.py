"""Driving a plan closed-loop on the dynamic model: tracking, contact, stopping."""
