"""Answers, fields, robots and messages as files for people and other programs."""
