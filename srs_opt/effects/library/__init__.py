"""The effects that every robot file may name: one file each, found by being here."""
