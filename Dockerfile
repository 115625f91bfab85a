FROM python:3.12
COPY . /onespp
CMD ["make", "-C", "/onespp", "demo"]
